"""What is said on the wire: commands to bytes and bytes to values, nothing else.

Every parser takes any bytes at all and either returns a value or raises
:class:`~app.mounts.conversation.ProtocolError`.
"""
