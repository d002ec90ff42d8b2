"""Tools of this repository: documentation, figures, validation, and the closed loop under several masters.

Run in the repository root as `python dev/tools COMMAND`.
"""
