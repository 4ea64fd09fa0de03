"""The far end of the line: what each make of mount answers, byte for byte, over one telescope."""

RESPONDERS: dict[str, str] = {
    "lx200": "app.simulate.responders.lx200:Lx200",
    "nexstar": "app.simulate.responders.nexstar:NexStar",
}
