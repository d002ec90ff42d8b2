"""The one exception whose text is meant for the user."""


class UserError(Exception):
    """Something the user can put right. The message is one line and says what and where; `prw` exits with status 1."""
