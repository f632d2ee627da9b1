// A client by @foxglove/ws-protocol, driven line by line: node foxglove_client.mjs URL [ORIGIN] [PROTOCOL]
//
// It reads JSON lines: {"subscribe": TOPIC}, {"unsubscribe": TOPIC}, {"advertise": {…}}, {"publish": TEXT},
// {"call": SERVICE_ID}, {"parameters": […]}, {"text": TEXT}, {"bytes": BASE64}, {"close": true}. It prints a JSON line for
// each thing that happens: {"what": "refused", "status", "reason"}, "open", "serverInfo", "advertise", "unadvertise",
// "status", "message" (topic, timestamp as text, text), "close" (code).
import { createRequire } from 'node:module';
import { createInterface } from 'node:readline';

const require = createRequire(new URL('../../web/package.json', import.meta.url));
const { FoxgloveClient } = require('@foxglove/ws-protocol');
const WebSocket = require('ws');

const [url, origin, protocol] = process.argv.slice(2);
const say = (what, values = {}) => console.log(JSON.stringify({ what, ...values }));
const socket = new WebSocket(url, [protocol || FoxgloveClient.SUPPORTED_SUBPROTOCOL], origin ? { origin } : {});
socket.on('unexpected-response', (request, response) => {
  let body = '';
  response.on('data', (piece) => (body += piece));
  response.on('end', () => {
    say('refused', { status: response.statusCode, ...JSON.parse(body) });
    process.exit(0);
  });
});

const client = new FoxgloveClient({ ws: socket });
const channels = new Map(); // by id
const subscriptions = new Map(); // topic by id
const decoder = new TextDecoder('utf-8', { fatal: true });
client.on('open', () => say('open', { protocol: socket.protocol }));
client.on('error', (error) => say('error', { message: String(error) }));
client.on('serverInfo', (facts) => say('serverInfo', facts));
client.on('status', (status) => say('status', status));
client.on('advertise', (list) => {
  for (const channel of list) channels.set(channel.id, channel);
  say('advertise', { channels: list });
});
client.on('unadvertise', (ids) => {
  say('unadvertise', { topics: ids.map((id) => channels.get(id).topic) });
  for (const id of ids) channels.delete(id);
});
client.on('message', ({ subscriptionId, timestamp, data }) =>
  say('message', { topic: subscriptions.get(subscriptionId), timestamp: String(timestamp), text: decoder.decode(data) }),
);
client.on('close', ({ code }) => {
  say('close', { code });
  process.exit(0);
});

const bytes = (text) => new TextEncoder().encode(text);
const act = {
  subscribe: (topic) => {
    const channel = [...channels.values()].find((each) => each.topic === topic);
    subscriptions.set(client.subscribe(channel.id), topic);
  },
  unsubscribe: (topic) => client.unsubscribe([...subscriptions].find(([, each]) => each === topic)[0]),
  advertise: (channel) => client.advertise(channel),
  publish: (text) => client.sendMessage(1, bytes(text)),
  call: (serviceId) => client.sendServiceCallRequest({ serviceId, callId: 1, encoding: 'json', data: bytes('{}') }),
  parameters: (parameters) => client.setParameters(parameters),
  text: (text) => socket.send(text),
  bytes: (base64) => socket.send(Buffer.from(base64, 'base64')),
  close: () => client.close(),
};
createInterface({ input: process.stdin }).on('line', (line) => {
  for (const [name, value] of Object.entries(JSON.parse(line))) act[name](value);
});
