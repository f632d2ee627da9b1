#!/usr/bin/env python3
"""What a lab puts behind mosquitto in an afternoon: a subscriber in Python (paho) that writes robots' samples to SQLite.

    mqtt_store.py DATABASE BROKER_PORT

QoS 1 and a session that the broker keeps, so that messages wait in the broker while this program is away. Samples are
committed each 100 ms. Prints "ready" when it has subscribed; SIGTERM commits what is there and ends. A stop does not come
through here: whoever stops publishes it, and the broker delivers it to the robot.
"""
import signal
import sys
import threading

import paho.mqtt.client

import rows


def main():
    database, waiting, lock, ends = rows.open_database(sys.argv[1]), [], threading.Lock(), threading.Event()
    client = paho.mqtt.client.Client("store", clean_session=False)

    def on_message(_client, _userdata, message):
        with lock:
            waiting.append((message.topic.split("/")[1], message.payload, rows.now_ms()))

    def commit():
        with lock:
            frames = waiting[:]
            waiting.clear()
        if frames:
            rows.commit(database, frames)

    client.on_connect = lambda client, *_: client.subscribe("robots/+/samples", qos=1)
    client.on_subscribe = lambda *_: print("ready", flush=True)
    client.on_message = on_message
    client.reconnect_delay_set(1, 1)
    signal.signal(signal.SIGTERM, lambda *_: ends.set())
    client.connect("127.0.0.1", int(sys.argv[2]))
    client.loop_start()
    while not ends.wait(rows.COMMIT_S):
        commit()
    client.loop_stop()
    commit()


if __name__ == "__main__":
    main()
