// Geometry: metres of the map's frame, cells from the lower left, and cells from the upper left.

export class Frame {
  constructor(map) {
    this.map = map;
    this.cos = Math.cos(map.yaw_rad);
    this.sin = Math.sin(map.yaw_rad);
  }

  /** The point of the map (cells from the upper left corner) at metres. */
  fromMetres([x, y]) {
    const { origin_m: origin, resolution_m: size, rows } = this.map;
    const [dx, dy] = [x - origin[0], y - origin[1]];
    return {
      x: (this.cos * dx + this.sin * dy) / size,
      y: rows - (this.cos * dy - this.sin * dx) / size,
    };
  }

  toMetres({ x, y }) {
    const { origin_m: origin, resolution_m: size, rows } = this.map;
    const [u, v] = [x * size, (rows - y) * size];
    return [
      origin[0] + this.cos * u - this.sin * v,
      origin[1] + this.sin * u + this.cos * v,
    ];
  }

  /** The point as the server counts: cells from the lower left corner. */
  toCells({ x, y }) {
    return [x, this.map.rows - y];
  }

  /** The point on the map of one as the server counts. */
  fromCells([x, y]) {
    return { x, y: this.map.rows - y };
  }

  /** Corners in cells of a box in metres, for any rotation of the map. */
  box([left, bottom, right, top]) {
    const corners = [
      [left, bottom],
      [right, bottom],
      [left, top],
      [right, top],
    ].map((corner) => this.fromMetres(corner));
    const xs = corners.map((corner) => corner.x);
    const ys = corners.map((corner) => corner.y);
    return [Math.min(...xs), Math.min(...ys), Math.max(...xs), Math.max(...ys)];
  }
}

/** The round number of metres, 1, 2 or 5 times a power of ten, that is at most this long. */
export function roundLength(metres) {
  const power = 10 ** Math.floor(Math.log10(metres));
  return [5, 2, 1].map((step) => step * power).find((length) => length <= metres) ?? power;
}
