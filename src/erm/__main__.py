"""Entry point of the command ``erm``."""

from erm.common.launch import launch


def main() -> None:
    """Run the command line."""
    launch("erm.cli")


if __name__ == "__main__":
    main()
