"""What all tests share."""

import signal

from hypothesis import settings

# Tests assert numbers, not speed: a busy machine fails none of them.
settings.register_profile("nichechain", deadline=None)
settings.load_profile("nichechain")

# A shell makes what it runs in the background deaf to Ctrl-C, and that is inherited.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)
