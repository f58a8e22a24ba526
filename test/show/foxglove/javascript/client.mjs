// Subscribes to all topics of a server with Foxglove's client; prints type by topic once a message of each is decoded.
import wsProtocol from "@foxglove/ws-protocol";
import { parse } from "@foxglove/rosmsg";
import { MessageReader } from "@foxglove/rosmsg2-serialization";
import WebSocket from "ws";

const [url, count] = [process.argv[2], Number(process.argv[3])];
const { FoxgloveClient } = wsProtocol;
const client = new FoxgloveClient({
  ws: new WebSocket(url, [FoxgloveClient.SUPPORTED_SUBPROTOCOL, "foxglove.sdk.v1"]), // as Lichtblick does
});
const topics = new Map();
const decoded = {};
client.on("error", (error) => { throw error; });
client.on("advertise", (channels) => {
  for (const channel of channels) {
    const reader = new MessageReader(parse(channel.schema, { ros2: true }));
    topics.set(client.subscribe(channel.id), { channel, reader });
  }
});
client.on("message", ({ subscriptionId, data }) => {
  const { channel, reader } = topics.get(subscriptionId);
  reader.readMessage(data);
  decoded[channel.topic] = channel.schemaName;
  if (Object.keys(decoded).length === count) {
    console.log(JSON.stringify(decoded));
    process.exit(0);
  }
});
