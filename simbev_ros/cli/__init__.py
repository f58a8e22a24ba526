"""The ``simbev`` command: one verb per file, or per package where a verb has parts."""

import os
import signal
import sys

from simbev_ros.foundation.installation.arithmetic import rounding_variables
from simbev_ros.foundation.installation.import_order import put_own_packages_first

os.environ.update(rounding_variables(os.environ))
put_own_packages_first()  # before the first import of a third-party package
if sys.argv[0] == "-m":  # starting: until main handles Ctrl-C, it ends the process at once, without a traceback
    signal.signal(signal.SIGINT, signal.SIG_DFL)
