"""Simulation and analysis of the pitch-roll wrist testbed, on top of its FMU. The command is `prw`."""
