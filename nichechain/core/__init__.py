"""What every room uses: errors, checks, keyed randomness, files, and draws from rows of a matrix."""
