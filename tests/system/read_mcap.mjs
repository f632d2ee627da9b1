// Reads an MCAP file with @mcap/core, as Foxglove does, and prints what is in it as JSON: node read_mcap.mjs FILE
//
//   {"statistics": {…}, "metadata": {name: {…}}, "channels": {topic: {"encoding", "schema_encoding", "schema_name",
//    "schema", "messages": [{"sequence", "log_time", "publish_time", "text"}, …]}}}
//
// Twice: from beginning to end, where the CRC of each chunk is checked, and by the index, in order of log time. Both must
// give the same messages. 64-bit numbers are printed as text.
import { readFileSync } from 'node:fs';
import { createRequire } from 'node:module';

const require = createRequire(new URL('../../web/package.json', import.meta.url));
const { McapIndexedReader, McapStreamReader } = require('@mcap/core');

const bytes = readFileSync(process.argv[2]);
const decoder = new TextDecoder('utf-8', { fatal: true });
const word = (message) => `${message.channelId} ${message.sequence} ${message.logTime} ${message.publishTime}`;

const streamed = [];
const stream = new McapStreamReader({ validateCrcs: true });
stream.append(bytes);
for (let record = stream.nextRecord(); record; record = stream.nextRecord()) {
  if (record.type === 'Message') streamed.push(`${word(record)} ${decoder.decode(record.data)}`);
}
if (!stream.done()) throw new Error('the file does not end');

const readable = {
  size: async () => BigInt(bytes.length),
  read: async (offset, length) => bytes.subarray(Number(offset), Number(offset + length)),
};
const reader = await McapIndexedReader.Initialize({ readable });
const channels = {};
for (const channel of reader.channelsById.values()) {
  const schema = reader.schemasById.get(channel.schemaId);
  channels[channel.topic] = {
    encoding: channel.messageEncoding,
    schema_encoding: schema.encoding,
    schema_name: schema.name,
    schema: JSON.parse(decoder.decode(schema.data)),
    messages: [],
  };
}
const indexed = [];
let last = 0n;
for await (const message of reader.readMessages()) {
  const text = decoder.decode(message.data);
  if (message.logTime < last) throw new Error('the index is not in order of log time');
  last = message.logTime;
  indexed.push(`${word(message)} ${text}`);
  channels[reader.channelsById.get(message.channelId).topic].messages.push({
    sequence: message.sequence,
    log_time: String(message.logTime),
    publish_time: String(message.publishTime),
    text,
  });
}
if (JSON.stringify(streamed.sort()) !== JSON.stringify(indexed.sort())) throw new Error('the index has other messages');
const metadata = {};
for await (const record of reader.readMetadata()) metadata[record.name] = Object.fromEntries(record.metadata);
const { statistics } = reader;
const text = (key, value) => {
  if (typeof value === 'bigint') return String(value);
  return value instanceof Map ? Object.fromEntries(value) : value;
};
console.log(JSON.stringify({ library: reader.header.library, statistics, metadata, channels }, text));
