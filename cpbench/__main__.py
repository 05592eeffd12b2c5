"""`python -m cpbench`, and the command `cpbench`."""

import sys


def main() -> None:
    """Run the command line, or show its help, for which nothing else is imported."""
    if sys.argv[1:] in ([], ["-h"], ["--help"]):
        from cpbench.help_text import help_text

        print(help_text())
        return
    from cpbench.cli import main as run

    run()


if __name__ == "__main__":
    main()
