"""Runs the stack until Ctrl-C: ``python -m simbev_ros.reference_stack``, next to ``simbev run live --live``."""

from simbev_ros.reference_stack.node import ReferenceStack, run_until_signal

if __name__ == "__main__":
    run_until_signal(ReferenceStack)
