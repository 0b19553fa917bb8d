"""Entry point of ``sounder``. It can be interrupted before it loads other modules."""

from erm.common.launch import launch


def main() -> None:
    """Run the command line."""
    launch("sounder.cli")


if __name__ == "__main__":
    main()
