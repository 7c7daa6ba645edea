// What has come in, by frame. Messages are decoded when they are looked at.
//
// Of a running graph, the newest frames are kept. Of a file all frames are known from the start, and
// messages are kept of those that are asked for.
import type { Channel, Header } from "./connection";
import type { FrameEntry } from "./state";

const kMaxFrames = 120;
const kMaxBytes = 400e6;

class Stored {
  private value: any = null;
  constructor(readonly channel: Channel, readonly bytes: Uint8Array) {}
  get(): any {
    return (this.value ??= this.channel.decode(this.bytes));
  }
}

export class Frame {
  readonly messages = new Map<string, Stored>(); // by topic
  // `time`: ms since 1970 when it began, 0 if that is not known.
  constructor(readonly key: string, readonly name: string, readonly sequence: number,
    readonly time = 0) {}
  has(topic: string): boolean {
    return this.messages.has(topic);
  }
  get(topic: string): any {
    return this.messages.get(topic)?.get() ?? null;
  }
}

export class Frames {
  readonly all: Frame[] = []; // oldest first
  private readonly byKey = new Map<string, Frame>();
  private readonly latched = new Map<string, Stored>();
  private bytes = 0;
  private isFile = false;

  // Returns the frame, unless the message belongs to none.
  add(channel: Channel, bytes: Uint8Array, latched: boolean): Frame | null {
    const stored = new Stored(channel, bytes);
    if (latched) {
      this.latched.set(channel.topic, stored);
      return null;
    }
    const frame = this.frameOf(channel.header(bytes));
    this.bytes += bytes.byteLength - (frame.messages.get(channel.topic)?.bytes.byteLength ?? 0);
    frame.messages.set(channel.topic, stored);
    this.trim(frame);
    return frame;
  }

  latest(topic: string): any {
    return this.latched.get(topic)?.get() ?? null;
  }

  // `frames`: all that there are, of a file.
  begin(frames: FrameEntry[] | null): void {
    this.isFile = frames !== null;
    this.all.length = 0;
    this.byKey.clear();
    this.latched.clear();
    this.bytes = 0;
    for (const one of frames ?? []) {
      const frame = new Frame(`${one.epoch}:${one.sequence}`, one.name, one.sequence, one.time);
      this.all.push(frame);
      this.byKey.set(frame.key, frame);
    }
  }

  // Of all other frames than these the messages go.
  keep(ranges: { from: number; to: number }[]): void {
    this.all.forEach((frame, i) => {
      if (!ranges.some(({ from, to }) => from <= i && i < to)) frame.messages.clear();
    });
  }

  private frameOf(header: Header): Frame {
    const key = `${header.epoch}:${header.sequence_number}`;
    const known = this.byKey.get(key);
    if (known !== undefined) return known;
    const frame = new Frame(key, header.name, Number(header.sequence_number));
    this.byKey.set(key, frame);
    // Nearly always the last; topics of one frame may overtake each other.
    let at = this.all.length;
    const epoch = `${header.epoch}:`;
    while (at > 0 && this.all[at - 1].key.startsWith(epoch) &&
           this.all[at - 1].sequence > frame.sequence) --at;
    this.all.splice(at, 0, frame);
    return frame;
  }

  private trim(newest: Frame): void {
    if (this.isFile) return;
    while (this.all.length > 1 && (this.all.length > kMaxFrames || this.bytes > kMaxBytes)) {
      const oldest = this.all[0] === newest ? this.all.splice(1, 1)[0] : this.all.shift()!;
      this.byKey.delete(oldest.key);
      for (const message of oldest.messages.values()) this.bytes -= message.bytes.byteLength;
    }
  }
}
