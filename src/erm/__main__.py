"""Entry point of ``erm``, which loads nothing before it can be interrupted."""

from erm.common.launch import launch


def main() -> None:
    """Run the command line."""
    launch("erm.cli")


if __name__ == "__main__":
    main()
