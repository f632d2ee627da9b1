// What a robot needs to connect, as a text for a QR code, as lines for its firmware, and for the simulator.
//
//   rheonaut-robot:1?id=rheo-1&token=wbCU54…&station=192.168.1.20:7070&pin=9f86d0…
//
// docs/cockpit.md, "Station", describes it. Without `pin` the station speaks plain TCP.

export interface RobotCredentials {
  robot_id: string;
  token: string;
  station: string; // ADDR:PORT as the robot reaches it
  pin: string; // SHA-256 of the station's public key in hexadecimal, '': no TLS
}

export function enrolment_text({ robot_id, token, station, pin }: RobotCredentials): string {
  const members = { id: robot_id, token, station, ...(pin === '' ? {} : { pin }) };
  // In a query ":" and brackets may stand as they are, and a person can read them.
  const written = (value: string) =>
    encodeURIComponent(value).replace(/%(3A|5B|5D)/g, (code) => decodeURIComponent(code));
  return `rheonaut-robot:1?${Object.entries(members)
    .map(([name, value]) => `${name}=${written(value)}`)
    .join('&')}`;
}

export const simulator_line = ({ robot_id, token, station, pin }: RobotCredentials) =>
  `rheonaut-sim --station ${station}${pin === '' ? '' : ` --tls-pin ${pin}`} --id ${robot_id} --token ${token}`;

// The members of kSecrets in robot_fw/esp8266/secrets.hpp that the station knows.
export function firmware_lines({ robot_id, token, station }: RobotCredentials): string {
  const { host, port } = parts_of(station) ?? { host: station, port: '' };
  return `"${robot_id}",\n"${token}",\n"WIFI-NAME", "WIFI-PASSWORD",\n"${host}",\n${port},`;
}

export function parts_of(address: string): { host: string; port: string } | null {
  const [, bracketed, plain, port] = /^(?:\[([^\]]+)\]|([^:\s[\]]+)):(\d{1,5})$/.exec(address.trim()) ?? [];
  const host = bracketed ?? plain;
  return host !== undefined && port !== undefined && Number(port) <= 65_535 ? { host, port } : null;
}

const kAnyAddress = ['0.0.0.0', '::'];
const is_loopback = (host: string) => host === 'localhost' || host === '::1' || host.startsWith('127.');

// Where robots reach the station: a station that listens on every address does not say by which one it is reached, and
// the name by which this page reached it is one of them.
export function reached_address(robots_address: string, page_host: string): string {
  const parts = parts_of(robots_address);
  if (!parts || !kAnyAddress.includes(parts.host)) return robots_address;
  const host = page_host.replace(/^\[|\]$/g, '');
  return `${host.includes(':') ? `[${host}]` : host}:${parts.port}`;
}

export function address_note(address: string): { problem: string; note: string } {
  const parts = parts_of(address);
  if (!parts)
    return { problem: `station = “${address}” is not ADDRESS:PORT, for example 192.168.1.20:7070.`, note: '' };
  return {
    problem: '',
    note: is_loopback(parts.host)
      ? 'Robots reach this address from the station’s own machine only. For others the station must listen beyond it, with TLS (docs/operations.md).'
      : '',
  };
}

// The dark modules of a QR code as one path of an SVG, a unit each, without the quiet zone.
export function module_path(modules: readonly (readonly boolean[])[]): string {
  const parts: string[] = [];
  modules.forEach((row, y) => {
    for (let x = 0; x < row.length; ++x) {
      if (!row[x]) continue;
      const from = x;
      while (x + 1 < row.length && row[x + 1]) ++x;
      parts.push(`M${from} ${y}h${x - from + 1}v1h-${x - from + 1}z`);
    }
  });
  return parts.join('');
}
