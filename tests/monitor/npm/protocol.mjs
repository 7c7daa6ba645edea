// Looks at a monitor through the protocol makers' own client and decoder. Prints what it saw as JSON
// when every topic that was asked for has brought two messages and the first service has answered
// to an order about a stage that there is not.
//   node protocol.mjs URL SUBPROTOCOL TOPIC...
import { parseIDL } from "@foxglove/omgidl-parser";
import { MessageReader } from "@foxglove/omgidl-serialization";
import protocol from "@foxglove/ws-protocol";
import WebSocket from "ws";

const [url, subprotocol, ...topics] = process.argv.slice(2);
const socket = new WebSocket(url, [subprotocol]);
const client = new protocol.FoxgloveClient({ ws: socket });
const seen = { channels: {}, messages: {}, values: {}, statuses: [] };
const subscriptions = new Map();

// Values as JSON that tests can compare: long arrays by their length, big integers as text.
function brief(value) {
  if (typeof value === "bigint") return String(value);
  if (ArrayBuffer.isView(value) || Array.isArray(value))
    return value.length > 16 ? { length: value.length } : Array.from(value, brief);
  if (value !== null && typeof value === "object")
    return Object.fromEntries(Object.entries(value).map(([key, one]) => [key, brief(one)]));
  return value;
}

client.on("error", (error) => {
  console.error(error);
  process.exit(1);
});
client.on("serverInfo", (info) => (seen.info = info));
client.on("status", (status) => seen.statuses.push(status));
client.on("connectionGraphUpdate", (update) => (seen.graph = update));
client.on("advertiseServices", ([service]) => {
  seen.service = service;
  const data = new TextEncoder().encode(JSON.stringify({ stage: "nobody" }));
  client.sendServiceCallRequest({ serviceId: service.id, callId: 7, encoding: "json",
    data: new DataView(data.buffer) });
});
client.on("serviceCallFailure", (failure) => (seen.refusal = failure));
client.on("advertise", (channels) => {
  for (const { schema, ...channel } of channels) {
    seen.channels[channel.topic] = { ...channel, schemaSize: schema.length };
    if (!topics.includes(channel.topic)) continue;
    const reader = channel.encoding === "cdr"
      ? new MessageReader(channel.schemaName, parseIDL(schema)) : null;
    subscriptions.set(client.subscribe(channel.id), { topic: channel.topic, reader });
  }
  client.subscribeConnectionGraph();
});
client.on("message", ({ subscriptionId, timestamp, data }) => {
  const { topic, reader } = subscriptions.get(subscriptionId);
  seen.messages[topic] = (seen.messages[topic] ?? 0) + 1;
  // Of a graph's state the newest; it may not be heard yet at first.
  if (reader === null || seen.values[topic] === undefined)
    seen.values[topic] = {
      timestamp: String(timestamp),
      value: brief(reader === null ? JSON.parse(new TextDecoder().decode(data))
        : reader.readMessage(data)),
    };
  if (seen.graph === undefined || seen.refusal === undefined ||
       topics.some((one) => !((seen.messages[one] ?? 0) >= 2))) return;
  seen.protocol = socket.protocol;
  console.log(JSON.stringify(seen));
  process.exit(0);
});
