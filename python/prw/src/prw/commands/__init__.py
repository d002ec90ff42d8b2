"""The subcommands of `prw`: options, a call of the function that does it, and what is said and written."""
