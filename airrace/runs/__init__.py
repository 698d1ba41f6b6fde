"""Runs: new, opened, resumed, solved and saved; their object for JSON; which stages still stand; how they end."""
