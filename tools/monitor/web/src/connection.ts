// A client of the Foxglove WebSocket protocol that connects again and again. Messages are handed on
// as bytes; a channel's `decode` makes values of them, by the schema that came with the channel.
import { parseIDL } from "@foxglove/omgidl-parser";
import { MessageReader } from "@foxglove/omgidl-serialization";

export interface Channel {
  id: number;
  topic: string;
  type: string; // "Cloud" of "cosegraph::msg::Cloud"
  decode(bytes: Uint8Array): any;
  // The part that every message of ours begins with.
  header(bytes: Uint8Array): Header;
}

export interface Header {
  stage: string;
  epoch: bigint;
  sequence_number: bigint;
  model_id: bigint;
  name: string;
}

export interface Events {
  connected(name: string): void;
  lost(): void;
  channels(all: Channel[]): void;
  message(channel: Channel, bytes: Uint8Array): void;
  dropped(sum: number): void;
  problem(text: string): void;
}

const kPrefix = "cosegraph::msg::";
const kMessageData = 1;
const kHeadSize = 13;
const kShortest = 500; // ms before the first new attempt
const kLongest = 5000;

export class Connection {
  private socket: WebSocket | null = null;
  private readonly channels = new Map<number, Channel>();
  private wanted = new Set<string>();
  private readonly subscribed = new Map<number, Channel>(); // by subscription
  private nextSubscription = 1;
  private patience = kShortest;

  constructor(private readonly url: string, private readonly events: Events) {
    this.connect();
  }

  // Topics whose messages are to come; all others stop.
  want(topics: Set<string>): void {
    this.wanted = topics;
    this.update();
  }

  private connect(): void {
    const socket = new WebSocket(this.url, ["foxglove.websocket.v1"]);
    socket.binaryType = "arraybuffer";
    socket.onmessage = (event) =>
      typeof event.data === "string" ? this.hear(JSON.parse(event.data)) : this.take(event.data);
    socket.onclose = () => this.lose();
    this.socket = socket;
  }

  private lose(): void {
    this.socket = null;
    this.channels.clear();
    this.subscribed.clear();
    this.events.lost();
    setTimeout(() => this.connect(), this.patience);
    this.patience = Math.min(kLongest, 1.5 * this.patience);
  }

  private hear(message: any): void {
    switch (message.op) {
      case "serverInfo":
        this.patience = kShortest;
        this.events.connected(message.name);
        break;
      case "advertise":
        for (const one of message.channels) this.channels.set(one.id, toChannel(one));
        this.events.channels([...this.channels.values()]);
        this.update();
        break;
      case "unadvertise":
        for (const id of message.channelIds) {
          this.channels.delete(id);
          for (const [subscription, channel] of this.subscribed)
            if (channel.id === id) this.subscribed.delete(subscription);
        }
        break;
      case "status":
        if (message.dropped !== undefined)
          this.events.dropped(
            Object.values(message.dropped as Record<string, number>).reduce((a, b) => a + b, 0));
        else if (message.level > 0) this.events.problem(message.message);
        break;
    }
  }

  private take(data: ArrayBuffer): void {
    const view = new DataView(data);
    if (view.getUint8(0) !== kMessageData) return;
    const channel = this.subscribed.get(view.getUint32(1, true));
    // Copied, so that arrays in it are aligned and can be used as they are.
    if (channel !== undefined)
      this.events.message(channel, new Uint8Array(data.slice(kHeadSize)));
  }

  private update(): void {
    if (this.socket?.readyState !== WebSocket.OPEN) return;
    const gone = [...this.subscribed].filter(([, channel]) => !this.wanted.has(channel.topic));
    for (const [subscription] of gone) this.subscribed.delete(subscription);
    if (gone.length > 0)
      this.say({ op: "unsubscribe", subscriptionIds: gone.map(([subscription]) => subscription) });
    const known = new Set([...this.subscribed.values()].map((channel) => channel.id));
    const subscriptions = [];
    for (const channel of this.channels.values()) {
      if (!this.wanted.has(channel.topic) || known.has(channel.id)) continue;
      const id = this.nextSubscription++;
      this.subscribed.set(id, channel);
      subscriptions.push({ id, channelId: channel.id });
    }
    if (subscriptions.length > 0) this.say({ op: "subscribe", subscriptions });
  }

  private say(message: object): void {
    this.socket?.send(JSON.stringify(message));
  }
}

function toChannel(one: any): Channel {
  const type: string = one.schemaName.startsWith(kPrefix)
    ? one.schemaName.slice(kPrefix.length) : one.schemaName;
  const channel = { id: one.id, topic: one.topic, type };
  if (one.encoding === "json") {
    const decode = (bytes: Uint8Array) => JSON.parse(new TextDecoder().decode(bytes));
    return { ...channel, decode, header: (bytes) => decode(bytes).header };
  }
  // Parsed when the first message comes: most channels are never looked at.
  let readers: { whole: MessageReader; header: MessageReader } | null = null;
  const make = () => {
    if (readers === null) {
      const definitions = parseIDL(one.schema);
      readers = {
        whole: new MessageReader(one.schemaName, definitions),
        header: new MessageReader(kPrefix + "FrameHeader", definitions),
      };
    }
    return readers;
  };
  return {
    ...channel,
    decode: (bytes) => make().whole.readMessage(bytes),
    header: (bytes) => make().header.readMessage(bytes) as Header,
  };
}
