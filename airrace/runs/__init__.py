"""Runs: new, opened, resumed, flown and saved; their object for JSON; which stages still stand; how they end."""
