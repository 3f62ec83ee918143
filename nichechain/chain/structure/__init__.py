"""What a chain is made of: classes, passage times, wormholes, metastable sets, graphs."""
