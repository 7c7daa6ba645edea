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

export type Report = Record<string, unknown>;

const kPrefix = "cosegraph::msg::";
const kMessageData = 1;
const kServiceRequest = 2;
const kServiceResponse = 3;
const kEncoding = new TextEncoder().encode("json");
const kHeadSize = 13;
const kShortest = 500; // ms before the first new attempt
const kLongest = 5000;

export class Connection {
  private socket: WebSocket | null = null;
  private readonly channels = new Map<number, Channel>();
  private wanted = new Set<string>();
  private parts: (number | undefined)[] = [undefined];
  private readonly subscribed = new Map<number, { channel: Channel; part?: number }>();
  private nextSubscription = 1;
  private patience = kShortest;
  private readonly services = new Map<string, number>(); // id by name
  private readonly calls = new Map<number, { resolve(report: Report): void;
    reject(error: Error): void }>();
  private nextCall = 1;

  constructor(private readonly url: string, private readonly events: Events) {
    this.connect();
  }

  // Topics whose messages are to come; all others stop. `parts`: of the frames of a file; none: all
  // that come.
  want(topics: Set<string>, parts: number[]): void {
    this.wanted = topics;
    this.parts = parts.length > 0 ? parts : [undefined];
    this.update();
  }

  offers(service: string): boolean {
    return this.services.has(service);
  }

  // Fails with the server's reason.
  call(service: string, request: object): Promise<Report> {
    const id = this.services.get(service);
    if (id === undefined || this.socket?.readyState !== WebSocket.OPEN)
      return Promise.reject(new Error("the monitor offers no such service now"));
    const body = new TextEncoder().encode(JSON.stringify(request));
    const bytes = new Uint8Array(kHeadSize + kEncoding.length + body.length);
    const head = new DataView(bytes.buffer);
    const call = this.nextCall++;
    head.setUint8(0, kServiceRequest);
    head.setUint32(1, id, true);
    head.setUint32(5, call, true);
    head.setUint32(9, kEncoding.length, true);
    bytes.set(kEncoding, kHeadSize);
    bytes.set(body, kHeadSize + kEncoding.length);
    this.socket.send(bytes);
    return new Promise((resolve, reject) => this.calls.set(call, { resolve, reject }));
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
    this.services.clear();
    for (const call of this.calls.values()) call.reject(new Error("the connection is lost"));
    this.calls.clear();
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
          for (const [subscription, one] of this.subscribed)
            if (one.channel.id === id) this.subscribed.delete(subscription);
        }
        break;
      case "advertiseServices":
        for (const one of message.services) this.services.set(one.name, one.id);
        break;
      case "unadvertiseServices":
        for (const [name, id] of this.services)
          if (message.serviceIds.includes(id)) this.services.delete(name);
        break;
      case "serviceCallFailure":
        this.calls.get(message.callId)?.reject(new Error(message.message));
        this.calls.delete(message.callId);
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
    if (view.getUint8(0) === kServiceResponse) return this.finish(view);
    if (view.getUint8(0) !== kMessageData) return;
    const channel = this.subscribed.get(view.getUint32(1, true))?.channel;
    // Copied, so that arrays in it are aligned and can be used as they are.
    if (channel !== undefined)
      this.events.message(channel, new Uint8Array(data.slice(kHeadSize)));
  }

  private finish(view: DataView): void {
    const call = view.getUint32(5, true);
    const body = new Uint8Array(view.buffer, kHeadSize + view.getUint32(9, true));
    this.calls.get(call)?.resolve(JSON.parse(new TextDecoder().decode(body)));
    this.calls.delete(call);
  }

  private update(): void {
    if (this.socket?.readyState !== WebSocket.OPEN) return;
    const gone = [...this.subscribed].filter(([, { channel, part }]) =>
      !this.wanted.has(channel.topic) || !this.parts.includes(part));
    for (const [subscription] of gone) this.subscribed.delete(subscription);
    if (gone.length > 0)
      this.say({ op: "unsubscribe", subscriptionIds: gone.map(([subscription]) => subscription) });
    const key = (channel: Channel, part?: number) => `${channel.id} ${part}`;
    const known = new Set([...this.subscribed.values()].map((one) => key(one.channel, one.part)));
    const subscriptions = [];
    for (const part of this.parts)
      for (const channel of this.channels.values()) {
        if (!this.wanted.has(channel.topic) || known.has(key(channel, part))) continue;
        const id = this.nextSubscription++;
        this.subscribed.set(id, { channel, part });
        subscriptions.push({ id, channelId: channel.id, part });
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
