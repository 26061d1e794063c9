"""A relay of TCP connections that holds every byte back for a while."""

from __future__ import annotations

import asyncio
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress

_CHUNK = 1 << 16  # bytes


@contextmanager
def delayed(host: str, port: int, delay: float) -> Iterator[int]:
    """Port of this machine whose connections lead to ``host:port``, ``delay`` [s] away in both directions."""
    loop = asyncio.new_event_loop()
    thread = threading.Thread(target=loop.run_forever, daemon=True)
    thread.start()

    async def meet(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        there, onward = await asyncio.open_connection(host, port)
        await asyncio.gather(_carry(reader, onward, delay), _carry(there, writer, delay))

    async def open_server() -> asyncio.Server:
        return await asyncio.start_server(meet, "127.0.0.1", 0)

    async def close() -> None:
        server.close()
        others = asyncio.all_tasks() - {asyncio.current_task()}
        for task in others:
            task.cancel()
        await asyncio.gather(*others, return_exceptions=True)

    server = asyncio.run_coroutine_threadsafe(open_server(), loop).result()
    try:
        yield int(server.sockets[0].getsockname()[1])
    finally:
        asyncio.run_coroutine_threadsafe(close(), loop).result()
        loop.call_soon_threadsafe(loop.stop)
        thread.join()
        loop.close()


async def _carry(reader: asyncio.StreamReader, writer: asyncio.StreamWriter, delay: float) -> None:
    """Write what is read, each chunk ``delay`` after it came; what comes meanwhile does not wait for it."""
    waiting: asyncio.Queue[tuple[float, bytes]] = asyncio.Queue()
    clock = asyncio.get_running_loop().time

    async def write() -> None:
        while True:
            due, data = await waiting.get()
            await asyncio.sleep(due - clock())
            if not data:
                return
            writer.write(data)
            await writer.drain()

    writing = asyncio.create_task(write())
    with suppress(ConnectionError):
        while data := await reader.read(_CHUNK):
            waiting.put_nowait((clock() + delay, data))
    waiting.put_nowait((clock() + delay, b""))
    with suppress(ConnectionError):
        await writing
    writer.close()
