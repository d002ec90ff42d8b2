"""The subcommands of `prw`: options, the call of a function, and the output."""
