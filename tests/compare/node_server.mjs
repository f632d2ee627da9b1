// A station as a lab writes it in an afternoon in Node: net, http, and better-sqlite3 in a worker thread.
//
//   node node_server.mjs DATABASE ROBOTS_PORT HTTP_PORT
//
// Robots and their frames: robots.py. POST /stop/NAME answers when the robot has. The worker commits each 100 ms, so that
// a slow disk does not hold up a stop. Prints "ready"; SIGTERM commits what is there and ends. The table is that of rows.py.
import { createServer as createHttp } from "node:http";
import { createRequire } from "node:module";
import { createServer } from "node:net";
import { isMainThread, parentPort, Worker, workerData } from "node:worker_threads";

const COMMIT_MS = 100;
const STOP_WITHIN_MS = 2000;

function record(path) {
  const Database = createRequire(`${process.env.COMPARE_NODE_MODULES ?? process.cwd()}/`)("better-sqlite3");
  const database = new Database(path);
  database.pragma("journal_mode = WAL");
  database.pragma("synchronous = FULL"); // what is committed survives a power cut
  database.exec(`CREATE TABLE IF NOT EXISTS robot (robot_id INTEGER PRIMARY KEY, name TEXT UNIQUE);
    CREATE TABLE IF NOT EXISTS sample (robot_id INTEGER, seq INTEGER, robot_time_us INTEGER, received_at_ms INTEGER,
      position_m REAL, velocity_m_s REAL, acceleration_m_s2 REAL, duty REAL, impedance_mv REAL, reference_m REAL,
      PRIMARY KEY (robot_id, seq)) WITHOUT ROWID;`);
  const addRobot = database.prepare("INSERT OR IGNORE INTO robot (name) VALUES (?)");
  const robotId = database.prepare("SELECT robot_id FROM robot WHERE name = ?").pluck();
  const insert = database.prepare("INSERT OR IGNORE INTO sample VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?, ?)");
  const ids = new Map();
  const commit = database.transaction((frames) => {
    for (const [name, bytes, receivedAtMs] of frames) {
      if (!ids.has(name)) {
        addRobot.run(name);
        ids.set(name, robotId.get(name));
      }
      const id = ids.get(name);
      const content = Buffer.from(bytes.buffer, bytes.byteOffset, bytes.byteLength);
      const first = content.readUInt32LE(0);
      const timeUs = Number(content.readBigUInt64LE(4));
      for (let at = 12, i = 0; at < content.length; at += 24, ++i) {
        insert.run(id, first + i, timeUs + 10000 * i, receivedAtMs, content.readFloatLE(at), content.readFloatLE(at + 4),
          content.readFloatLE(at + 8), content.readFloatLE(at + 12), content.readFloatLE(at + 16), content.readFloatLE(at + 20));
      }
    }
  });
  parentPort.on("message", ({ frames, ends }) => {
    commit(frames);
    if (!ends) return;
    database.close();
    parentPort.postMessage("ended");
  });
}

function serve(databasePath, robotsPort, httpPort) {
  const disk = new Worker(new URL(import.meta.url), { workerData: databasePath });
  const sockets = new Map();
  const stops = new Map();
  let frames = [];
  let lastStop = 0;

  function robot(socket) {
    let waiting = Buffer.alloc(0);
    let name;
    socket.setNoDelay(true);
    socket.on("data", (received) => {
      waiting = waiting.length ? Buffer.concat([waiting, received]) : received;
      while (waiting.length >= 3 && waiting.length >= 2 + waiting.readUInt16LE(0)) {
        const end = 2 + waiting.readUInt16LE(0);
        const content = waiting.subarray(3, end);
        if (waiting[2] === 2) {
          frames.push([name, new Uint8Array(content), Date.now()]);
        } else if (waiting[2] === 1) {
          name = content.toString();
          sockets.set(name, socket);
        } else if (waiting[2] === 3) {
          stops.get(content.readUInt32LE(0))?.(200);
        }
        waiting = waiting.subarray(end);
      }
    });
    socket.on("error", () => {});
    socket.on("close", () => {
      if (sockets.get(name) === socket) sockets.delete(name);
    });
  }

  function stop(name, answer) {
    const socket = sockets.get(name);
    if (!socket) return answer(404);
    const number = ++lastStop;
    const late = setTimeout(() => stops.get(number)?.(504), STOP_WITHIN_MS);
    stops.set(number, (status) => {
      clearTimeout(late);
      stops.delete(number);
      answer(status);
    });
    const message = Buffer.alloc(5, "S");
    message.writeUInt32LE(number, 1);
    socket.write(message);
  }

  const http = createHttp((request, response) => {
    const name = request.method === "POST" && request.url.startsWith("/stop/") ? request.url.slice(6) : undefined;
    const answer = (status) => response.writeHead(status, { "Content-Length": 0 }).end();
    if (name === undefined) answer(404);
    else stop(name, answer);
  });
  setInterval(() => {
    if (frames.length) disk.postMessage({ frames });
    frames = [];
  }, COMMIT_MS);
  disk.on("message", () => process.exit(0));
  process.on("SIGTERM", () => disk.postMessage({ frames, ends: true }));
  createServer(robot).listen(robotsPort, "127.0.0.1", () =>
    http.listen(httpPort, "127.0.0.1", () => console.log("ready")));
}

if (isMainThread) serve(process.argv[2], Number(process.argv[3]), Number(process.argv[4]));
else record(workerData);
