"""``python -m companion``: the app alone, as it runs on the drone."""

import sys

from companion.app.command_line import main

if __name__ == "__main__":
    sys.exit(main())
