"""The same with asyncio: what asks the server is awaited."""

import asyncio

from urbihw.client import aio


async def main() -> None:
    """Write, read, watch."""
    async with await aio.connect() as robot:
        await robot.motor6.val.set(0.25)
        print(await robot.motor6.val)
        async with robot.watch("motor6.val", hz=50) as samples:
            async for _, values in samples:
                print(values)
                break


asyncio.run(main())
