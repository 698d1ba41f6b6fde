"""What a run is: new, opened, resumed, flown and saved; its object for JSON; which stages still stand; how it ends."""
