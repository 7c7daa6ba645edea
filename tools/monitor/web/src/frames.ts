// What has come in, by frame. Bounded; the oldest frames go first. Messages are decoded when they
// are looked at.
import type { Channel, Header } from "./connection";

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
  constructor(readonly key: string, readonly name: string, readonly sequence: number) {}
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

  clear(): void {
    this.all.length = 0;
    this.byKey.clear();
    this.latched.clear();
    this.bytes = 0;
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
    while (this.all.length > 1 && (this.all.length > kMaxFrames || this.bytes > kMaxBytes)) {
      const oldest = this.all[0] === newest ? this.all.splice(1, 1)[0] : this.all.shift()!;
      this.byKey.delete(oldest.key);
      for (const message of oldest.messages.values()) this.bytes -= message.bytes.byteLength;
    }
  }
}
