"""Entry point of ``sounder``, which loads nothing before it can be interrupted."""

from erm.common.launch import launch


def main() -> None:
    """Run the command line."""
    launch("sounder.cli")


if __name__ == "__main__":
    main()
