// Decodes every message of a bag with Foxglove's libraries; prints, by topic, their number and their headers' stamps.
import { McapIndexedReader } from "@mcap/core";
import { parse } from "@foxglove/rosmsg";
import { MessageReader } from "@foxglove/rosmsg2-serialization";
import { decompress } from "fzstd";
import { open } from "node:fs/promises";

const file = await open(process.argv[2], "r");
const readable = {
  async size() { return BigInt((await file.stat()).size); },
  async read(offset, length) {
    const buffer = new Uint8Array(Number(length));
    await file.read(buffer, 0, Number(length), Number(offset));
    return buffer;
  },
};
const reader = await McapIndexedReader.Initialize({
  readable,
  decompressHandlers: { zstd: (buffer, size) => decompress(buffer, new Uint8Array(Number(size))) },
});
const decoders = new Map();
const counts = {};
for await (const message of reader.readMessages()) {
  const channel = reader.channelsById.get(message.channelId);
  if (!decoders.has(channel.schemaId)) {
    const schema = reader.schemasById.get(channel.schemaId);
    decoders.set(channel.schemaId, new MessageReader(parse(new TextDecoder().decode(schema.data), { ros2: true })));
  }
  const decoded = decoders.get(channel.schemaId).readMessage(message.data);
  const stamp = decoded.header?.stamp ?? decoded.clock;
  const entry = (counts[channel.topic] ??= { messages: 0, stamps: [] });
  entry.messages += 1;
  if (stamp) entry.stamps.push((BigInt(stamp.sec) * 1000000000n + BigInt(stamp.nanosec ?? stamp.nsec)).toString());
}
console.log(JSON.stringify(counts));
