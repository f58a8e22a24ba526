"""``simbev export``: writes datasets in the layouts of other projects."""
