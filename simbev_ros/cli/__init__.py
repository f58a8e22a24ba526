"""The command line: one verb a file."""

import signal
import sys

if sys.argv[0] == "-m":  # it is being started: until main listens to Ctrl-C, that ends it at once, without a traceback
    signal.signal(signal.SIGINT, signal.SIG_DFL)
