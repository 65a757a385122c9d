"""Do what an assistant does: start ``urbihw mcp``, look at its tools, move a joint.  Needs the extra ``mcp``."""

import asyncio
import sys
from pathlib import Path

from mcp import Client, StdioServerParameters

COMMAND = str(Path(sys.executable).with_name("urbihw"))


async def main() -> None:
    server = StdioServerParameters(command=COMMAND, args=["mcp", "--role", "drive", *sys.argv[1:]])
    async with Client(server) as client:
        print(", ".join(tool.name for tool in (await client.list_tools()).tools))
        answer = await client.call_tool("move", {"goals": {"motor6": 0.5}})
        print(getattr(answer.content[0], "text", ""))


asyncio.run(main())
