"""What only this repository needs: its documentation, its figures, its validation, the closed loop under
several masters.

Run in the project's folder as `python -m tools COMMAND`.
"""
