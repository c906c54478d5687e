"""Which settings make another program's filter consistent? The program is run as it is; its settings are moved."""
