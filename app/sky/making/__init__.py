"""How the shipped catalogue is made from registry packages; nothing here runs during a solve."""
