// Prints a recording as JSON, its index and all messages, as read by the library of the Foxglove application.
import { readFileSync } from "node:fs";
import { McapIndexedReader } from "@mcap/core";
import { decompress } from "fzstd";

const bytes = readFileSync(process.argv[2]);
const readable = {
  size: async () => BigInt(bytes.length),
  read: async (offset, length) => new Uint8Array(bytes.subarray(Number(offset), Number(offset + length))),
};
const decompressHandlers = { zstd: (data, size) => decompress(data, new Uint8Array(Number(size))) };
const reader = await McapIndexedReader.Initialize({ readable, decompressHandlers });

const channels = [...reader.channelsById.values()].map((channel) => {
  const schema = reader.schemasById.get(channel.schemaId);
  return {
    topic: channel.topic,
    encoding: channel.messageEncoding,
    schema: schema.name,
    schemaEncoding: schema.encoding,
    properties: Object.keys(JSON.parse(new TextDecoder().decode(schema.data)).properties),
  };
});
const messages = [];
for await (const message of reader.readMessages()) {
  const body = JSON.parse(new TextDecoder().decode(message.data));
  messages.push({ topic: reader.channelsById.get(message.channelId).topic, logTime: String(message.logTime), body });
}
const attachments = {};
for await (const attachment of reader.readAttachments()) {
  attachments[attachment.name] = new TextDecoder().decode(attachment.data);
}
console.log(JSON.stringify({ messageCount: String(reader.statistics.messageCount), channels, messages, attachments }));
