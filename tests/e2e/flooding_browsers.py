"""Browsers that ask as fast as they can, in a process of their own: ``flooding_browsers.py URL COOKIE...``."""

from __future__ import annotations

import asyncio
import json
import sys

import aiohttp

TEXTS = [json.dumps({"id": 1, **each}) for each in (
    {"do": "get", "slot": "motor6.val"}, {"do": "tree"}, {"do": "jobs"}, {"do": "events", "slots": ["x" * 60_000]},
)]  # fmt: skip


async def flood(http: aiohttp.ClientSession, url: str, cookie: str) -> None:
    """Ask until this process is killed; come back whenever the gateway ends the connection."""
    while True:
        try:
            async with http.ws_connect(url, headers={"Cookie": cookie}) as socket:
                reading = asyncio.create_task(read(socket))
                while not socket.closed:
                    for text in TEXTS:
                        await socket.send_str(text)
                    await asyncio.sleep(0)
                await reading
        except (aiohttp.ClientError, ConnectionError):
            await asyncio.sleep(0.1)


async def read(socket: aiohttp.ClientWebSocketResponse) -> None:
    """Read all that comes."""
    async for _ in socket:
        await asyncio.sleep(0)


async def main(url: str, *cookies: str) -> None:
    """Flood with a browser for each cookie."""
    async with aiohttp.ClientSession() as http:
        await asyncio.gather(*(flood(http, url, cookie) for cookie in cookies))


if __name__ == "__main__":
    asyncio.run(main(*sys.argv[1:]))
