"""`python -m cpbench`, and the command `cpbench`."""


def main() -> None:
    """Run the command line."""
    from cpbench.cli import main as run

    run()


if __name__ == "__main__":
    main()
