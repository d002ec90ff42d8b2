"""The command `prw`, also as `python -m prw`."""

import sys


def main() -> int:
    """Run `prw`. Returns the exit status, 130 also for an interrupt during the imports, which take most of the time of short
    commands."""
    try:
        from prw import interrupts

        interrupts.wait_for_imports()
        from prw.cli import main as run

        return run()
    except KeyboardInterrupt:
        print("\nprw: interrupted", file=sys.stderr)
        return 130


if __name__ == "__main__":
    sys.exit(main())
