"""What only this repository needs: its documentation, its figures, the closed loop under several masters.

Run in the project's folder as `python -m tools COMMAND`.
"""
