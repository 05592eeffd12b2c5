"""`python -m cpbench`, and the command `cpbench`."""

import os
import sys


def main() -> None:
    """Run the command line, or show its help, for which nothing else is imported."""
    if sys.argv[1:] in ([], ["-h"], ["--help"]) and "_CPBENCH_COMPLETE" not in os.environ:  # a shell asks without words
        from cpbench.foundation.help_text import help_text

        try:
            print(help_text(), flush=True)
        except BrokenPipeError:  # as after `cpbench | head -1`; the exit would write the rest again
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return
    from cpbench.cli import main as run

    run()


if __name__ == "__main__":
    main()
