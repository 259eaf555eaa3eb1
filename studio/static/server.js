// The server: questions to it, and its news. Addresses are relative, so each carries the token.

export class Server {
  constructor() {
    this.tab = [...crypto.getRandomValues(new Uint8Array(8))]
      .map((byte) => byte.toString(16).padStart(2, "0"))
      .join("");
  }

  /** The answer to a question. */
  async get(path, values = {}, options = {}) {
    const query = new URLSearchParams(values).toString();
    return answered(await fetch(query ? `${path}?${query}` : path, options));
  }

  /** The answer to a request that changes something. */
  async post(path, body, options = {}) {
    const request = {
      method: "POST",
      headers: { "content-type": "application/json" },
      body: JSON.stringify(body),
      ...options,
    };
    const response = await fetch(path, request).catch(() => {
      throw new Error("Not saved: the studio is not running. Restart it.");
    });
    return answered(response);
  }

  /** Hand over each new state, for as long as the page is open; `lost` hears why there is none. */
  async follow(take, lost) {
    let after = -1;
    for (;;) {
      try {
        const state = await this.get("state", { after, tab: this.tab });
        after = state.tick;
        keepAddress();
        take(state);
      } catch (error) {
        lost({ refused: error.status === 403, address: error.status === 403 ? newerAddress() : null });
        await new Promise((resume) => setTimeout(resume, 700));
        after = -1;
      }
    }
  }
}

async function answered(response) {
  const text = await response.text();
  if (response.ok) return JSON.parse(text);
  let problem = text;
  try {
    problem = JSON.parse(text).problem;
  } catch {
    // The guard answers in plain words.
  }
  throw Object.assign(new Error(problem || `the studio answered ${response.status}`), { status: response.status });
}

const ADDRESS = "address"; // of the newest studio at this host and port

function keepAddress() {
  try {
    if (localStorage.getItem(ADDRESS) !== location.href) localStorage.setItem(ADDRESS, location.href);
  } catch {
    // A browser that keeps nothing cannot tell other tabs.
  }
}

/** Where the studio is that has taken this one's place, if another tab has opened it. */
function newerAddress() {
  try {
    const address = localStorage.getItem(ADDRESS);
    return address !== location.href && address?.startsWith(location.origin) ? address : null;
  } catch {
    return null;
  }
}
