"""What all tests share."""

from hypothesis import settings

# Tests assert numbers, not speed: a busy machine fails none of them.
settings.register_profile("nichechain", deadline=None)
settings.load_profile("nichechain")
