"""The ``simbev`` command: one verb per file, or per package where a verb has parts."""

import signal
import sys

if sys.argv[0] == "-m":  # starting: until main handles Ctrl-C, it ends the process at once, without a traceback
    signal.signal(signal.SIGINT, signal.SIG_DFL)
