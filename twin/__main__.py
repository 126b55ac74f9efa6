"""`python -m twin`, the same as the `twin` command."""

from twin.cli.main import main

main()
