"""``simbev evaluate``, and the evaluation options and tables of ``simbev run`` and ``simbev replay``."""
