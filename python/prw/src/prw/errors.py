"""The exceptions whose text is meant for the user."""


class UserError(ValueError):
    """Something the user can put right. The message is one line and says what and where; `prw` exits with `status`."""

    status = 1


class MissingPackage(UserError, ImportError):
    """A package that only some of `prw` needs is not installed."""


class DoesNotFit(UserError):
    """The model does not explain the data, whatever its parameters."""

    status = 3
