"""The far end of the line: what each make of mount answers, byte for byte, over one telescope."""

RESPONDERS: dict[str, str] = {
    "lx200": "app.simulate.responders.lx200:Lx200",
    "onstep": "app.simulate.responders.onstep:OnStep",
    "nexstar": "app.simulate.responders.nexstar:NexStar",
    "synscan": "app.simulate.responders.synscan:SynScan",
    "ioptron": "app.simulate.responders.ioptron:IOptron",
    "skywatcher": "app.simulate.responders.skywatcher:SkyWatcher",
}
