// A robot that has just been enrolled: its token, once, as text, as a QR code, and as its firmware and a simulator take it.

import { useSignal } from '@preact/signals';
import type { Context } from './facts';
import { address_note, enrolment_text, firmware_lines, reached_address, simulator_line } from './enrolment';
import { Copyable, Field, WordMark } from './parts';
import { QrCode } from './qr_code';
import type { NewEnrolment } from './station_api';

interface EnrolledProps {
  context: Context;
  enrolment: NewEnrolment;
  on_done(): void;
}

export function Enrolled({ context, enrolment, on_done }: EnrolledProps) {
  const { session } = context;
  const station = session.station.value;
  const address = useSignal(reached_address(station?.robots_address ?? '', location.hostname));
  const { problem, note } = address_note(address.value);
  const { robot_id, secret } = enrolment;
  const credentials = {
    robot_id,
    token: secret,
    station: address.value.trim(),
    pin: station?.security.robots === 'tls' ? (station.security.certificate?.pin_sha256 ?? '') : '',
  };
  const text = enrolment_text(credentials);
  const known = session.store.find(robot_id);
  const is_connected = known !== null && known !== undefined && !known.is_away.value && context.is_current;
  return (
    <div class="station-secret" id="station-enrolled">
      <header>
        <h2>Robot {robot_id}</h2>
        <p role="status" id="station-enrolled-link">
          {is_connected ? <WordMark word="good">connected</WordMark> : 'waits for its first connection'}
        </p>
      </header>
      <p>
        This is its token. It is shown only now, and nobody can read it again: write it into the robot before you press
        “Done”.
      </p>
      <div class="station-enrolled-parts">
        <div>
          <h3>Token</h3>
          <Copyable id="station-robot-secret" label="the token" text={secret} is_secret />
          <Field
            id="station-robot-address"
            label="Address of the station, as the robot reaches it"
            value={address.value}
            is_wrong={problem !== ''}
            on_input={(typed) => (address.value = typed)}
          />
          {problem ? (
            <p class="station-problem" role="alert">
              {problem}
            </p>
          ) : (
            note && <p class="station-note caution">{note}</p>
          )}
          <h3>Firmware: kSecrets in robot_fw/esp8266/secrets.hpp</h3>
          <Copyable
            id="station-firmware-lines"
            label="the lines for the firmware"
            text={firmware_lines(credentials)}
            is_secret
          />
          <p class="station-note">
            {credentials.pin === ''
              ? 'The station speaks plain TCP with robots. The board’s firmware needs a station with TLS: docs/operations.md.'
              : 'Behind them comes the station’s public key, as rheonaut certificate prints it.'}
          </p>
          <h3>Simulated robot</h3>
          <Copyable
            id="station-sim-line"
            label="the command of the simulator"
            text={simulator_line(credentials)}
            is_secret
          />
        </div>
        <figure>
          <QrCode id="station-robot-code" text={text} label={`QR code with what ${robot_id} needs to connect`} />
          <figcaption>
            Name, token, address{credentials.pin === '' ? '' : ' and certificate pin'} in one text
            <Copyable id="station-robot-text" label="the text of the QR code" text={text} is_secret />
          </figcaption>
        </figure>
      </div>
      <button type="button" id="station-enrolled-done" onClick={on_done}>
        Done: the robot has it
      </button>
    </div>
  );
}
