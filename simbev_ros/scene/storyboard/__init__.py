"""Scenarios that prescribe what entities do and when: ASAM OpenSCENARIO XML 1.0 to 1.3."""
