// Hands on the plots: drag to move along the time axis, wheel and pinch to zoom, keys for both.
//
// Space, Enter and Escape are none of its keys: they belong to what has to be pressed, and to the stop.

export interface HandWays {
  pan(by_px: number): void; // the samples move with the hand
  zoom(factor: number, at_px: number): void; // < 1: closer
  point(at_px: number | null): void; // where values are read; null: nowhere
  run(): void; // back to live
  middle_px(): number;
  width_px(): number;
}

const kSlack_px = 4; // a press that moves less is no drag
const kWheelZoom = 0.0016; // per pixel of the wheel
const kLine_px = 16; // what a wheel's line and page are worth
const kKeyPan = 0.1;
const kKeyZoom = 1.5;

export class PlotHand {
  private readonly fingers = new Map<number, number>(); // x of each pointer that is down
  private moved_px = 0;

  constructor(private readonly ways: HandWays) {}

  get is_dragging(): boolean {
    return this.fingers.size > 0 && this.moved_px > kSlack_px;
  }

  down(id: number, x_px: number): void {
    if (this.fingers.size === 2) return;
    this.fingers.set(id, x_px);
    this.moved_px = 0;
    this.ways.point(x_px);
  }

  move(id: number, x_px: number): void {
    const from_px = this.fingers.get(id);
    if (from_px === undefined) {
      if (this.fingers.size === 0) this.ways.point(x_px);
      return;
    }
    const others = [...this.fingers].filter(([other]) => other !== id).map(([, at_px]) => at_px);
    this.moved_px += Math.abs(x_px - from_px);
    if (!this.is_dragging && others.length === 0) return;
    this.fingers.set(id, x_px);
    const [other_px] = others;
    if (other_px === undefined) this.ways.pan(x_px - from_px);
    else this.pinch(other_px, from_px, x_px);
    this.ways.point(x_px);
  }

  // Two fingers keep what lies under them.
  private pinch(still_px: number, from_px: number, to_px: number): void {
    const [before, after] = [Math.abs(from_px - still_px), Math.abs(to_px - still_px)];
    if (before < 8 || after < 8) return;
    this.ways.zoom(before / after, still_px);
  }

  up(id: number): void {
    this.fingers.delete(id);
  }

  leave(): void {
    if (this.fingers.size === 0) this.ways.point(null);
  }

  wheel(wheel: Pick<WheelEvent, 'deltaX' | 'deltaY' | 'deltaMode' | 'shiftKey'>, x_px: number): void {
    const unit_px = wheel.deltaMode === 0 ? 1 : wheel.deltaMode === 1 ? kLine_px : 20 * kLine_px;
    const [along, across] = wheel.shiftKey ? [wheel.deltaY, 0] : [wheel.deltaX, wheel.deltaY];
    if (Math.abs(along) > Math.abs(across)) this.ways.pan(-along * unit_px);
    else if (across !== 0) this.ways.zoom(Math.exp(across * unit_px * kWheelZoom), x_px);
  }

  // False: the key is none of ours.
  key(event: Pick<KeyboardEvent, 'key' | 'ctrlKey' | 'metaKey' | 'altKey'>): boolean {
    if (event.ctrlKey || event.metaKey || event.altKey) return false;
    const { pan, zoom, run, middle_px, width_px } = this.ways;
    switch (event.key) {
      case 'ArrowLeft':
        pan(kKeyPan * width_px());
        return true;
      case 'ArrowRight':
        pan(-kKeyPan * width_px());
        return true;
      case 'PageUp':
        pan(width_px());
        return true;
      case 'PageDown':
        pan(-width_px());
        return true;
      case '+':
      case '=':
        zoom(1 / kKeyZoom, middle_px());
        return true;
      case '-':
        zoom(kKeyZoom, middle_px());
        return true;
      case 'End':
        run();
        return true;
      default:
        return false;
    }
  }
}
