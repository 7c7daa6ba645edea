// Prints what the format's own libraries find in an MCAP file, as JSON: by its indexes, or, for a
// file that was cut off, from its start on (--stream). Numbers of 64 bits are printed as texts.
import { readFile } from "node:fs/promises";
import { crc32 } from "@foxglove/crc";
import { parseIDL } from "@foxglove/omgidl-parser";
import { MessageReader } from "@foxglove/omgidl-serialization";
import { McapIndexedReader, McapStreamReader } from "@mcap/core";
import { decompress } from "fzstd";

const decompressHandlers = { zstd: (bytes, size) => decompress(bytes, new Uint8Array(Number(size))) };

function decoderOf(schema) {
  if (schema?.encoding !== "omgidl") throw new Error(`schema encoding ${schema?.encoding}`);
  return new MessageReader(schema.name, parseIDL(new TextDecoder().decode(schema.data)));
}

// What is read with the indexes of the summary.
async function readIndexed(bytes) {
  const readable = {
    size: async () => BigInt(bytes.byteLength),
    read: async (offset, size) => bytes.subarray(Number(offset), Number(offset + size)),
  };
  const reader = await McapIndexedReader.Initialize({ readable, decompressHandlers });
  const decoders = new Map();
  const messages = [];
  for await (const message of reader.readMessages({ validateCrcs: true })) {
    const channel = reader.channelsById.get(message.channelId);
    const schema = reader.schemasById.get(channel.schemaId);
    if (!decoders.has(schema.id)) decoders.set(schema.id, decoderOf(schema));
    messages.push({
      topic: channel.topic,
      type: schema.name,
      encoding: channel.messageEncoding,
      metadata: Object.fromEntries(channel.metadata),
      sequence: message.sequence,
      logTime: message.logTime,
      value: decoders.get(schema.id).readMessage(message.data),
    });
  }
  const attachments = {};
  for await (const one of reader.readAttachments({ validateCrcs: true }))
    attachments[one.name] = new TextDecoder().decode(one.data);
  const metadata = {};
  for await (const one of reader.readMetadata()) metadata[one.name] = Object.fromEntries(one.metadata);
  const dataBytes = bytes.subarray(0, Number(reader.dataEndOffset));
  return {
    library: reader.header.library,
    dataCrcFits: reader.dataSectionCrc === crc32(dataBytes),
    chunks: reader.chunkIndexes.length,
    statistics: reader.statistics,
    messages,
    attachments,
    metadata,
  };
}

// What is read record by record, as far as it goes.
function readStream(bytes) {
  const reader = new McapStreamReader({ decompressHandlers });
  reader.append(bytes);
  const counts = {};
  for (let record; (record = reader.nextRecord()); )
    counts[record.type] = (counts[record.type] ?? 0) + 1;
  return { done: reader.done(), counts };
}

function plain(_key, value) {
  if (typeof value === "bigint") return value.toString();
  if (value instanceof Map) return Object.fromEntries([...value].map(([k, v]) => [String(k), v]));
  return ArrayBuffer.isView(value) ? Array.from(value) : value;
}

const [file, mode] = process.argv.slice(2);
const bytes = new Uint8Array(await readFile(file));
const result = mode === "--stream" ? readStream(bytes) : await readIndexed(bytes);
console.log(JSON.stringify(result, plain));
