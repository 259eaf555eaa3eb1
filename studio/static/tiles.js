// Tiles: a layer's pictures, fetched when they come into view, with a bounded cache.

const MOST = 360;

export class TileLayer {
  /** `name` as the server knows it; `changed` is called when a picture has come. */
  constructor(name, changed) {
    this.name = name;
    this.changed = changed;
    this.version = "0";
    this.theme = "light";
    this.cache = new Map();
    this.waiting = 0;
  }

  /** Whether all that is in view is of the present version. */
  get settled() {
    return this.waiting === 0;
  }

  draw(context, view, map) {
    const level = bestLevel(view.scale * view.ratio, map.levels);
    const side = map.tile * 2 ** level;
    const from = view.toMap(0, 0);
    const to = view.toMap(view.width, view.height);
    const last = {
      column: Math.ceil(map.columns / side) - 1,
      row: Math.ceil(map.rows / side) - 1,
    };
    context.imageSmoothingEnabled = view.scale * 2 ** level < 1.9;
    for (let row = clamp(from.y / side, last.row); row <= clamp(to.y / side, last.row); row++) {
      for (let c = clamp(from.x / side, last.column); c <= clamp(to.x / side, last.column); c++) {
        this.#drawTile(context, level, row, c, map);
      }
    }
    this.#forget();
  }

  #drawTile(context, level, row, column, map) {
    const side = map.tile * 2 ** level;
    const entry = this.#entry(level, row, column);
    if (entry.image) {
      context.drawImage(entry.image, column * side, row * side, side, side);
      return;
    }
    // Meanwhile the part of a coarser picture, if there is one.
    for (let up = 1; level + up < map.levels; up++) {
      const parts = 2 ** up;
      const coarse = this.cache.get(key(level + up, Math.floor(row / parts), Math.floor(column / parts)));
      if (!coarse?.image) continue;
      const size = map.tile / parts;
      const [x, y] = [(column % parts) * size, (row % parts) * size];
      context.drawImage(coarse.image, x, y, size, size, column * side, row * side, side, side);
      return;
    }
  }

  #entry(level, row, column) {
    const name = key(level, row, column);
    let entry = this.cache.get(name);
    if (entry) this.cache.delete(name);
    else entry = { image: null, wanted: null };
    this.cache.set(name, entry); // the newest are last
    const version = `${this.version}.${this.theme}`;
    if (entry.wanted !== version) {
      entry.wanted = version;
      this.#fetch(entry, version, `tile/${encodeURIComponent(this.name)}/${level}/${row}/${column}.png`);
    }
    return entry;
  }

  async #fetch(entry, version, path) {
    const image = new Image();
    image.src = `${path}?v=${encodeURIComponent(this.version)}&theme=${this.theme}`;
    this.waiting += 1;
    try {
      await image.decode();
      if (entry.wanted === version) entry.image = image;
    } catch {
      if (entry.wanted === version) setTimeout(() => (entry.wanted = null), 1000);
    } finally {
      this.waiting -= 1;
      this.changed();
    }
  }

  #forget() {
    for (const name of this.cache.keys()) {
      if (this.cache.size <= MOST) return;
      this.cache.delete(name);
    }
  }
}

/** The level whose pixels are nearest to those of the screen. */
export function bestLevel(scale, levels) {
  return Math.max(0, Math.min(levels - 1, Math.round(Math.log2(1 / scale))));
}

const key = (level, row, column) => `${level}/${row}/${column}`;
const clamp = (value, last) => Math.max(0, Math.min(last, Math.floor(value)));
