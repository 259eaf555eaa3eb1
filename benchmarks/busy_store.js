// A local S3 whose files lie in a folder, and which refuses a share of the requests with 503.
// node busy_store.js FOLDER PORT SHARE COUNTS: each of its processes writes its counts every second
// to a file of the folder COUNTS.

const cluster = require("cluster");
const fs = require("fs");
const S3rver = require("s3rver");

const PROCESSES = 4;

function serve(directory, port, share, countsFolder) {
  const counts = { requests: 0, refused: 0, done: 0 };
  const server = new S3rver({ address: "127.0.0.1", port, directory, silent: true });
  server.middleware.unshift(async (context, next) => {
    counts.requests += 1;
    if (Math.random() < share) {
      counts.refused += 1;
      for await (const part of context.req); // else the connection could not be used again
      context.status = 503;
      context.type = "application/xml";
      context.body = "<Error><Code>SlowDown</Code><Message>Reduce your request rate.</Message></Error>";
      return;
    }
    await next();
    counts.done += context.method === "PUT" && context.path.endsWith("/manifest.json");
  });
  const file = `${countsFolder}/${process.pid}`;
  server.run().then(() => {
    setInterval(() => {
      fs.writeFileSync(`${file}.new`, JSON.stringify(counts));
      fs.renameSync(`${file}.new`, `${file}.json`);
    }, 1000);
  });
}

const [directory, port, share, countsFolder] = process.argv.slice(2);
if (cluster.isPrimary) {
  for (let number = 0; number < PROCESSES; number += 1) cluster.fork();
} else {
  serve(directory, Number(port), Number(share), countsFolder);
}
