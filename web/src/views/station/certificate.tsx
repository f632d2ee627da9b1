// Certificate and encryption: what each port speaks, the certificate in force, and the pin that robots know it by.

import { format } from '../../route';
import type { Context } from './facts';
import { span_text } from './moments';
import { Copyable, Fact, Nothing, Panel, Problem, When } from './parts';

const kPort = { tls: 'with TLS', plain: 'plain TCP' };

export function Certificate({ context }: { context: Context }) {
  const { facts, problem, is_current, is_utc } = context;
  if (!facts) return problem ? <Problem text={problem} /> : <Nothing is_known={false}>{null}</Nothing>;
  const { security, http_address, robots_address } = facts.station;
  const { certificate } = security;
  const left_s = certificate ? (certificate.not_after_us / 1000 - facts.asked_at_ms) / 1000 : 0;
  return (
    <div id="station-certificate" class={is_current ? '' : 'was'}>
      <Panel id="station-ports" title="Ports">
        <dl class="facts">
          <Fact name="Pages and scripts">
            {http_address}, {kPort[security.http]}
          </Fact>
          <Fact name="Robots">
            {robots_address}, {kPort[security.robots]}
          </Fact>
          <Fact name="Reached by others">
            {security.exposed ? (
              <span class="bad">
                in plain TCP: anyone on the network can read along and drive. tls.insecure is set; take it out and make
                a certificate.
              </span>
            ) : certificate ? (
              'by TLS only'
            ) : (
              'no: from this machine only'
            )}
          </Fact>
        </dl>
      </Panel>
      <Panel id="station-certificate-in-force" title="Certificate in force">
        {certificate ? (
          <>
            <dl class="facts">
              <Fact name="Names">{certificate.names.join(', ')}</Fact>
              <Fact name="Valid until">
                <When at_us={certificate.not_after_us} is_utc={is_utc} />{' '}
                <span class={certificate.expires_soon ? 'caution' : 'quiet'}>
                  {left_s > 0 ? `${span_text(left_s)} more` : 'it has expired'}
                </span>
              </Fact>
            </dl>
            <h3>Pin: SHA-256 of the station’s public key</h3>
            <Copyable id="station-pin" label="the pin" text={certificate.pin_sha256} />
            <p class="station-note">
              Robots and tools know the station by it. Renewing keeps the key, so the pin stays.
            </p>
            <h3>Renew it, while the station runs</h3>
            <Copyable
              id="station-renew"
              label="the command that renews"
              text="rheonaut certificate --renew --data FOLDER"
            />
            <h3>A key that others may have seen: a new one, and every pin is new</h3>
            <Copyable
              id="station-new-key"
              label="the command for a new key"
              text="rheonaut certificate --renew --new-key --data FOLDER"
            />
          </>
        ) : (
          <>
            <p>None: no port speaks TLS. None is needed while only this machine reaches the station.</p>
            <p class="station-note">
              For other machines, make one for the names by which they reach it, and listen on that address
              (docs/operations.md, “TLS in five commands”):
            </p>
            <Copyable
              id="station-make-certificate"
              label="the command that makes a certificate"
              text="rheonaut certificate --data FOLDER --name lab-pc.local"
            />
          </>
        )}
        <p class="station-note">
          The station does not ask clients for certificates:{' '}
          <a href={format({ view: 'station', parts: ['sessions'] })}>sessions</a> and{' '}
          <a href={format({ view: 'station', parts: ['tokens'] })}>tokens</a> say who they are.
        </p>
      </Panel>
    </div>
  );
}
