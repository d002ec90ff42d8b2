"""The one exception whose text is meant for the user."""


class UserError(Exception):
    """Something the user can put right. The message is one line and says what and where; `prw` exits with `status`."""

    status = 1


class DoesNotFit(UserError):
    """The model does not explain the data, whatever its parameters."""

    status = 3
