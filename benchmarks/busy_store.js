// A local S3 whose files lie in a folder, and which refuses a share of the requests with 503.
// node busy_store.js FOLDER PORT SHARE COUNTS; every second it writes its counts to a file.

const fs = require("fs");
const S3rver = require("s3rver");

const [directory, port, share, countsFile] = process.argv.slice(2);
const counts = { requests: 0, refused: 0, done: 0 };

const server = new S3rver({ address: "127.0.0.1", port: Number(port), directory, silent: true });
server.middleware.unshift(async (context, next) => {
  counts.requests += 1;
  if (Math.random() < Number(share)) {
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
server.run().then(() => {
  setInterval(() => fs.writeFileSync(countsFile, JSON.stringify(counts)), 1000);
});
